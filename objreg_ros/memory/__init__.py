# SPDX-License-Identifier: Apache-2.0
"""What is remembered, and found again.

The `store` is one SQLite file: a `store_file` under a `claim`, keyframes as rows by the `codec`, each with its
`checksum`, written and deleted by a `transaction` that counts them in the `counters`; those of 0.2.0 are brought here
by `migration`. A `veto` is a closure that a person withdrew. A `sighting` is one object of one keyframe, `landmarks`
are objects over all of them, of which each is `known` by numbers, and whose `landmark_position` its sightings give.
`retrieval` of what may be here again goes by the `nearest_neighbours` of a `descriptor`. `compact` makes a keyframe few
bytes, to be sent in an `envelope`. `params` has the parameters.
"""
