# SPDX-License-Identifier: Apache-2.0
"""The only place that says yes. One file per kind of evidence, each with its checks and what they need.

A check takes plain numbers and answers None, or a `refusal`: a reason with its numbers. `verdict` asks all checks in
order. `limits` are their numbers, made from the parameters. The evidence, in the order of the checks: `convergence`,
the prior of `odometry`, `gravity`, `overlap`, `free_space`, `photometric` correlation, `view_score`, matched and moved
`objects`, the appearance of a `lone_object` and what else is asked of its pose, the `surroundings` of few objects,
`competing` hypotheses, `observability`.
"""
