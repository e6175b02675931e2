# SPDX-License-Identifier: Apache-2.0
"""Inputs brought together by their time, and topics out: what nodes subscribe to and publish."""
