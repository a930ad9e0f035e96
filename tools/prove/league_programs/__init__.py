"""What single programs state as σ of a block."""
