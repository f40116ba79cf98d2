"""Takes every coloured thing that a camera sees to the bin, and everything else to the tray.

Needs a cell: GEMELO_CELL=urdf/rm1/cell.toml make up
"""

import gemelo

with gemelo.connect() as arm:
    arm.move(named="ready")
    for seen in arm.detect():
        if seen.kind == "tag" and seen.name == "tray":
            continue
        try:
            print(arm.pick(seen.name, to="bin" if seen.kind == "colour" else "tray"), flush=True)
        except gemelo.Refused as refused:
            print(refused, flush=True)
        arm.move(named="ready")  # out of the camera's way
