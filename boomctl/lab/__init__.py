"""What the package is measured by: published papers, run time against error, promises where they are hardest."""
