"""The predictive motion prior (PMP): a CVAE that sums up in 64 numbers what the arms will do next."""
