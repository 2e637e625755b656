"""Files in and out: animations as OpenUSD."""
