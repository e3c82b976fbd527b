"""The motion and the reactions of a linkage as a program of vector operations, which compiled kernels carry out."""
