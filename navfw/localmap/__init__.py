"""The local map."""
