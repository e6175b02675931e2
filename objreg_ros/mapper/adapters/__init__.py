# SPDX-License-Identifier: Apache-2.0
"""Constraints for other mappers, one file each. They fill messages that the caller makes and import none, so they need
no other package: ``rtabmap.fill_link(AddLink.Request().link, constraint, 12, 97)``.
"""
