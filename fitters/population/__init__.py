"""Many samples: batches on all cores or a cluster, and their statistics."""
