# SPDX-License-Identifier: MIT
"""python -m okid.capture"""

import sys

from okid.capture import main

sys.exit(main())
