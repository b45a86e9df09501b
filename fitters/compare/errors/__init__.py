"""What makes two recordings differ without any change, and the evidence beside it."""
