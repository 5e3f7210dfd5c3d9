# Writes OUTPUT, a C++ file with the texts of INPUTS; called by embed_kernels.
set(text "#include \"core/device/kernel_source.h\"\n\nnamespace treelight {\n\nstd::string_view KernelSource(std::string_view name) {\n")
foreach(input ${INPUTS})
  get_filename_component(name ${input} NAME)
  file(READ ${input} content)
  string(APPEND text "  if (name == \"${name}\") {\n    return R\"kernel(#line 1 \"${name}\"\n${content})kernel\";\n  }\n")
endforeach()
string(APPEND text "  return {};\n}\n\n}  // namespace treelight\n")
file(WRITE ${OUTPUT} "${text}")
