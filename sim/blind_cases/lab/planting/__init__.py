"""What is planted in a specimen: the effects, the imperfections of every device, and what of them can be seen."""
