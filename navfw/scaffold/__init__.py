"""New projects and their parts, and schemas for editors."""
