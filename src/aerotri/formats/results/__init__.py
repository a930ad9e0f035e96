"""What the program writes about a block: results, solutions, surfaces; the one place that writes JSON."""
