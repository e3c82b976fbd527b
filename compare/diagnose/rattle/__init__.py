"""Clearance of rigs that rattle: where pins fly and bounce, no sample can be foretold, but their statistics can."""
