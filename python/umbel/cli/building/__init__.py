"""What `umbel build` does with its inputs: one file, or many in several processes."""
