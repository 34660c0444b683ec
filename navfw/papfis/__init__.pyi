from .routes import Route as Route
