"""Alignment on the way: one training that puts right what it learns from.

At some steps of a training its views are rendered small (`look`). The flow from these
renders to the photos says how cameras move (`cameras`) and how photos are warped
(`photos`). The training goes on with both. `aligner` does that in a training's loop,
`store` keeps what was found beside the checkpoint, `outputs` writes it for other
stages. Flow and training meet here.
"""
