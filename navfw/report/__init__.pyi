from .report_page import PerceivePage as PerceivePage
from .run_moments import read_moments as read_moments
from .run_page import live_page as live_page
