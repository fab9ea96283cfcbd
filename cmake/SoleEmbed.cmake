# sole_embed(TARGET NAME FILE): compiles the bytes of FILE into TARGET. A source that uses them declares
#   namespace sole::embedded { std::string_view NAME(); }
function(sole_embed target name file)
  set(output "${CMAKE_CURRENT_BINARY_DIR}/embedded_${name}.cpp")
  get_filename_component(input "${file}" ABSOLUTE)
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" -DINPUT=${input} -DOUTPUT=${output} -DNAME=${name}
            -P "${PROJECT_SOURCE_DIR}/cmake/EmbedFile.cmake"
    DEPENDS "${input}" "${PROJECT_SOURCE_DIR}/cmake/EmbedFile.cmake"
    VERBATIM)
  target_sources(${target} PRIVATE "${output}")
endfunction()
