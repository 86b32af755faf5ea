// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
int main2() { return 0; }
