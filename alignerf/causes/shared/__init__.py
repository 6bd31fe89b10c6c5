"""What several causes ask of an Evidence; none of these modules is a cause.

`misalignment`: how far photos and renders are apart, and the least that would be seen.
`at_stake`: what removing a cause is estimated to bring.
`remedies`: what this run has tried, and whether it pays.
"""
