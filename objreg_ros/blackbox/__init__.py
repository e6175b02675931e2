# SPDX-License-Identifier: Apache-2.0
"""The last seconds of all inputs, as they came: kept in memory, and written to a file when something went wrong."""
