"""What studies share: workers, clusters, results that a later run takes up."""
