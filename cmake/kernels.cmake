# embed_kernels(TARGET FILE...): compiles the text of each kernel file into TARGET, for KernelSource(name) of
# core/device/kernel_source.h. Each text begins with #line 1 "name", so that errors name the file.
function(embed_kernels target)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${target}_kernels.cc)
  set(inputs)
  foreach(file ${ARGN})
    list(APPEND inputs ${CMAKE_CURRENT_SOURCE_DIR}/${file})
  endforeach()
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} "-DINPUTS=${inputs}" -P ${PROJECT_SOURCE_DIR}/cmake/embed.cmake
    DEPENDS ${inputs} ${PROJECT_SOURCE_DIR}/cmake/embed.cmake
    VERBATIM)
  target_sources(${target} PRIVATE ${output})
endfunction()
