"""Physics that no catalogue lists: corrections as functions of frequency, and the laws they follow."""
