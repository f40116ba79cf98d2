"""Takes what is red to the bin and every other coloured thing to the tray, as a camera sees them.

Needs a table: GEMELO_CELL=urdf/ARM/cell.toml make up
"""

import gemelo

with gemelo.connect() as arm:
    arm.move(named="ready")
    for seen in arm.detect():
        if seen.kind != "colour":
            continue
        try:
            print(arm.pick(seen.name, to="bin" if "red" in seen.name else "tray"), flush=True)
        except gemelo.Refused as refused:
            print(refused, flush=True)
        arm.move(named="ready")  # out of the camera's way
