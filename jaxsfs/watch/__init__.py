"""Live pictures: the newest frame of a source, depth drawn over it, and a page that shows it."""

from jaxsfs.watch._newest import Newest as Newest
from jaxsfs.watch._overlay import overlay as overlay
from jaxsfs.watch._page import Page as Page
