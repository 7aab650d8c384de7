# SPDX-License-Identifier: MIT
"""python -m okid.live"""

import sys

from okid.live import main

sys.exit(main())
