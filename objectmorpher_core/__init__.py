"""ObjectMorpher's method as a library: numpy in, numpy out, no window.

    from objectmorpher_core import pipeline, script, image

    wishes = script.script_from({"click": [[310, 240]], "turn": [20, 0, 0]})
    edited = pipeline.run_script(photo_bytes, "photo.jpg", wishes)
    png_bytes = image.encode_picture(edited.picture, ".png")
    figures = edited.report()

Where the parts of the paper (ObjectMorpher, CVPR 2026) are:

    3.1    choosing the object            segment/, models/
    3.1    image to 3D Gaussians          lift/, gaussians.py
    3.2.1  control points and graph       deform/control_points.py, deform/graph.py
    3.2.2  ARAP, Eq. 2-4                  deform/arap.py, deform/links.py, deform/deformer.py
    3.2.2  skinning, Eq. 5 and ours       deform/faithful_skinning.py, deform/skinning.py
    3.3    picture, background, blending  raster/, compose/

A `document.Document` is all that is saved and undone; `edits` are its changes; `puppet.Puppet` is a
lifted object that can be posed, drawn and picked.
"""
