"""Tasks on many cores or machines, by Dask: scheduling, retries, memory limits and dead workers are its business."""
