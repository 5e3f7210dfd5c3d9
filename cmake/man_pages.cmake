# Writes the manual pages of treelightd, of treelight and of each of its commands, from what their --help prints. Run by
# `cmake --install`; HELP2MAN, TREELIGHTD, TREELIGHT are programs, FOLDER is where the pages go.

# write_page(NAME COMMAND WHAT): the page of COMMAND as NAME.1.gz; WHAT is its line in whatis(1).
function(write_page name command what)
  execute_process(
    COMMAND ${HELP2MAN} --no-info --name ${what} ${command}
    OUTPUT_VARIABLE page COMMAND_ERROR_IS_FATAL ANY)
  # help2man takes the first word of the command for the name.
  string(TOUPPER ${name} title)
  string(REGEX REPLACE "\\.TH [A-Z]+ " ".TH ${title} " page "${page}")
  string(REGEX REPLACE "\n\\.SH NAME\n[^ ]+ " "\n.SH NAME\n${name} " page "${page}")
  file(WRITE ${FOLDER}/${name}.1 "${page}")
  execute_process(COMMAND gzip -9nf ${FOLDER}/${name}.1 COMMAND_ERROR_IS_FATAL ANY)
endfunction()

write_page(treelightd ${TREELIGHTD} "serves photon maps")
write_page(treelight ${TREELIGHT} "builds and queries photon maps on a treelightd")
execute_process(COMMAND ${TREELIGHT} --help OUTPUT_VARIABLE help COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE ".*\nSubcommands:\n" "" commands "${help}")
string(REGEX REPLACE "\n\n.*" "" commands "${commands}")
string(REPLACE ";" "|" commands "${commands}")
string(REPLACE "\n" ";" commands "${commands}")
foreach(line IN LISTS commands)
  if(line MATCHES "^  ([a-z]+) +([A-Z])([^|]*)")
    string(TOLOWER ${CMAKE_MATCH_2} first_letter)
    write_page(treelight-${CMAKE_MATCH_1} "${TREELIGHT} ${CMAKE_MATCH_1}" "${first_letter}${CMAKE_MATCH_3}")
  endif()
endforeach()
