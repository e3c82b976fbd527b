"""What the project says of itself: evidence that is stored in ``reports/``, made again and compared."""
