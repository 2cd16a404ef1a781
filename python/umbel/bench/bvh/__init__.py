"""`umbel bench bvh`: builders of hierarchies compared, on the processor and on CUDA."""
