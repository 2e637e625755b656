"""What ``warp-springs bench`` measures: cases, their check against the reference, their speed."""
