# SPDX-License-Identifier: Apache-2.0
"""Registrars of other robots, of which nothing is believed but what they do: who they are, and who waits for what."""
