"""The whole surface by semi-global matching of pairs, fused cell by cell, with a σ for every cell."""
