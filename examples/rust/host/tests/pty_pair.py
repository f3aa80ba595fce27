"""Two pseudo-terminals as one line: prints the paths of both ends, and carries bytes until its input ends."""

import os
import select
import sys
import tty

pairs = [os.openpty() for _ in range(2)]
for _, end in pairs:
    tty.setraw(end)
print(*(os.ttyname(end) for _, end in pairs), flush=True)
(first, _), (second, _) = pairs
while True:
    ready = select.select([first, second, 0], [], [])[0]
    if 0 in ready:
        break
    for one, other in [(first, second), (second, first)]:
        if one in ready:
            os.write(other, os.read(one, 512))
