from .run_page import live_page as live_page
