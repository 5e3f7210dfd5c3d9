#ifndef TREELIGHT_CORE_DEVICE_OPENCL_H_
#define TREELIGHT_CORE_DEVICE_OPENCL_H_

// The C++ bindings with exceptions; included in place of <CL/opencl.hpp>. OpenCL 1.2 is what every
// device offers.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#include <CL/opencl.hpp>
#pragma GCC diagnostic pop

#endif  // TREELIGHT_CORE_DEVICE_OPENCL_H_
