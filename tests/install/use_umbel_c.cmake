# The program in C, with every warning that a strict project may have on.
add_executable(use_umbel_c ${CMAKE_CURRENT_LIST_DIR}/use_umbel.c)
set_target_properties(use_umbel_c PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
target_compile_options(use_umbel_c PRIVATE -Wall -Wextra -pedantic -Werror)
target_link_libraries(use_umbel_c PRIVATE umbel::umbel)
