#include "core/device/resident_groups.h"

#include "gtest/gtest.h"

namespace treelight {
namespace {

constexpr char kTwoKernels[] =
    ".version 8.0\n"
    ".entry sums(\n\t.param .u64 sums_param_0\n)\n{\n\tret;\n}\n"
    ".entry sums_of_64(\n\t.param .u64 p\n)\n.reqntid 64, 1, 1\n{\n\tret;\n}\n";

TEST(ResidentGroupsTest, TheDirectiveStandsBeforeTheKernelsBody) {
  EXPECT_EQ(WithResidentGroups(kTwoKernels, {"sums_of_64", 21}),
            ".version 8.0\n"
            ".entry sums(\n\t.param .u64 sums_param_0\n)\n{\n\tret;\n}\n"
            ".entry sums_of_64(\n\t.param .u64 p\n)\n.reqntid 64, 1, 1\n.minnctapersm 21\n"
            "{\n\tret;\n}\n");
}

TEST(ResidentGroupsTest, WhatIsNoPtxOrHasNoSuchKernelOfFixedSizeIsLeftAlone) {
  EXPECT_EQ(WithResidentGroups("", {"sums", 2}), "");
  EXPECT_EQ(WithResidentGroups("\177ELF", {"sums", 2}), "");
  EXPECT_EQ(WithResidentGroups(kTwoKernels, {"sum", 2}), "");
  EXPECT_EQ(WithResidentGroups(kTwoKernels, {"sums", 2}), "") << "the size of its groups is open";
}

}  // namespace
}  // namespace treelight
