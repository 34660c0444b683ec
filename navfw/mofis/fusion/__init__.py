"""Command fusion: ways to make one command of all behaviours' proposals (METHOD 3, Pirjanian)."""
