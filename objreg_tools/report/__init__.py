# SPDX-License-Identifier: Apache-2.0
"""The outputs of a run, for people and for other programs.

`run` is the page of a run, `store` that of a store, `batch` that of many recordings, `sweep` that of many settings;
`closures` says what constraints close, and by what; `exports` are files of other programs. `page` and `write` make
pages of templates; `drawing`, `packed` and `bundle` are what all of them draw with, `words` what they say of counts.
"""
