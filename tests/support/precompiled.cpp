// SPDX-License-Identifier: BSD-3-Clause
// Nothing: the headers that tests share are precompiled with it (tests/CMakeLists.txt).
