# SPDX-License-Identifier: Apache-2.0
"""How the model in models/ was made. Not installed; needs torch and onnx. models/README.md has the commands."""
