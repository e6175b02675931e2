# SPDX-License-Identifier: Apache-2.0
"""What is there to be seen: meshes, objects with their prints, furniture, rooms."""
