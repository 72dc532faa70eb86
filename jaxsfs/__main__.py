"""`python -m jaxsfs` for `jaxsfs`."""

import sys

from jaxsfs.cli import main

sys.exit(main())
