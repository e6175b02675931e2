# SPDX-License-Identifier: Apache-2.0
"""The only place that says yes. `verdict` asks a few rules, one file each, and then how likely the pose is right.

A rule takes plain numbers and answers None, or a `refusal`: a reason with its numbers. The rules are of `convergence`,
the prior of `odometry`, `gravity`, `free_space`, matched and moved `objects`, the `surroundings` of few objects,
`competing` hypotheses, and `observability`. The `likelihood` adds up what each of the `kinds` of evidence says, by
fitted `weights`. `limits` are the numbers, some of them made from the parameters.
"""
