"""A linkage whose names hold whatever a name may hold in a file."""

import json

# Hostile in HTML, in scripts and in terminals.
HOSTILE = 'x\'"><img src=http://a.test/ onerror=bad()></script><script>bad()</script>\u202e'
LINKAGE = f"""
name: {json.dumps(HOSTILE)}
source: {json.dumps(HOSTILE)}
pivots: {{A: [0, 0]}}
crank: crank
foot: C
bodies:
  crank: {{bars: [{{from: A, to: B, length: 0.05}}]}}
  rod: {{bars: [{{from: B, to: C, length: 0.15}}]}}
  piston: {{slides: {{along: ground, from: A, to: C}}}}
start: {{crank: 1.0, rod: -0.2, piston: 0.17}}
"""
