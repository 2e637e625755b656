import sys, time, pickle
from pathlib import Path
import warp_springs as ws
from stability_maps import measure
from stability_figure import draw

ws.quiet()
t = time.time()
m = measure(int(sys.argv[1]), int(sys.argv[2]))
print(time.time() - t)
pickle.dump(m, open("/tmp/stab/maps.pkl", "wb"))
print([(x.axis.name, x.integrator, x.violations) for x in m])
draw(m, Path("/tmp/stab/stability.png"))
