"""Files in and out: results, and animations as OpenUSD."""
