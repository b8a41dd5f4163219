"""What the package costs and how exact it is, beside its peers: run time and error of the same jobs, in one run."""
