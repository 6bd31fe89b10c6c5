"""In-loop alignment: one training that corrects its own cameras and photos.

At some steps of a training its views are rendered small (`look`). The flow from these
renders to the photos says how cameras move (`cameras`) and how photos are warped
(`photos`). The training goes on with both. `aligner` does that in a training's loop,
`store` keeps the corrections beside the checkpoint, and writes them for other stages.
`loss` is a training that searches its photos instead of moving what it learns from.
This is the only package that imports both flow and training.
"""
