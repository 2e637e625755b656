"""From genomes to scores: trials, simulated here, in worker processes, or on many machines."""
