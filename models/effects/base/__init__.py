"""What effects are made of: the device they change, laws and loads they modify."""
