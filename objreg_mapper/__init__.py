# SPDX-License-Identifier: Apache-2.0
"""The reference consumer: odometry and constraints in, a corrected trajectory out. A user's own mapper is the normal
case; this one shows what it has to get right (`constraint`) and what it may copy (`adapters`)."""
