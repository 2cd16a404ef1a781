"""What tests and experiments need that users of meshes do not."""
