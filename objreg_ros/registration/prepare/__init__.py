# SPDX-License-Identifier: Apache-2.0
"""What is computed once a keyframe: `prepared` of its `views`, `keypoints`, `fpfh` features, `normals` and `voxels`.

The last ones stay in the `prepared_cache`.
"""
