// Empty: see ../Cargo.toml.
