"""What engines share without weakening each other."""
