# SPDX-License-Identifier: Apache-2.0
"""Messages to the data types of data/ and back: the only folder that knows the fields of messages."""
