"""The languages that are fuzzed: words to put anywhere into a file, and small grammars to grow a file from."""

from __future__ import annotations

RAPID_WORDS = (
    'MoveL ', 'MoveJ ', 'MoveC ', 'MoveAbsJ ', 'Offs(', 'RelTool(', 'CONST robtarget p10:=', 'PERS ', 'VAR ', 'LOCAL ',
    'MODULE A\n', 'ENDMODULE\n', 'PROC main()\n', 'ENDPROC\n', 'IF TRUE THEN\n', 'ENDIF\n', 'FOR i FROM 1 TO 9 DO\n',
    'ENDFOR\n', 'TEST n\n', 'CASE 1:\n', '\\WObj:=wobj0', '\\V:=30', '\\Corr', '\\Conc', 'p10', 'p20', 'pts{1}', 'pts{n}',
    '{2}', '9E9', '9E+09', 'v100', 'fine', 'z1', 'tool0', '[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]', '*',
    '! rem\n', '"', ';', ':=', '%%%\n', 'TRAP t\n', 'FUNC num f()\n', 'RECORD r\n', 'ALIAS num m;\n', 'GOTO x;\n', 'x:\n',
    'DIV', 'MOD', 'NOT ', 'CRobT()', '\x1a')
APT_WORDS = (
    'GOTO/', 'FEDRAT/', 'RAPID\n', 'CIRCLE/', 'MOVARC/', 'INDIRV/', 'TLON,GOFWD/', 'CYCLE/', 'TRACUT/', 'UNITS/INCHES\n',
    '$\n', '$$', 'MULTAX/ON\n', 'LOADTL/2\n', 'SPINDL/OFF\n', 'GODLTA/', 'FROM/', 'FINI\n', 'NOMORE\n',
    'COPY/1,TRANSL,0,0,5,3\n', 'INDEX/1\n', 'ARCSLP/ON\n', 'PPRINT ', 'TIMES,99999', 'ANGLE,', 'DEEP,DEPTH,5',
    'STEP,0.0001', 'RETURN,', 'CUTCOM/LEFT\n', 'ROTATE/', '1E300', 'DELAY/1\n', 'COOLNT/ON\n', 'TLAXIS/0,0,1\n', 'OFF\n',
    'NULL', 'LINE/', ',,', '/', '(', ')')
YAML_WORDS = (
    '{', '}', '[', ']', ': ', '- ', '&a ', '*a', '<<: *a', '!!python/object:os.system ', '!!binary ', '~', 'null', 'true',
    '| \n', '? ', '---\n', '...\n', '%YAML 1.2\n', '!!set ', '0x10', '0o7', '1_000', '.inf', '.nan', '1:30:00',
    '2001-01-01', '\t', 'robot', 'tool', 'force_log', 'columns: [a, a]', 'limits', "'", '"', '\\x00', '# ')
CSV_WORDS = (
    ',', ';', '\t', '\n', '\r\n', '"', '""', "'", '#', '=1+1', 'nan', 'inf', '1,5', '1.234,5', '1e', '0x1F', 'target',
    'x_mm', 'time_s', 'fx_n', '\ufeff', '\x00', ' ', '--', 'TRUE', '1_0', '١٢', '−5', '1e400', '½')
JSON_WORDS = (
    '{', '}', '[', ']', ':', ',', 'null', 'true', 'NaN', 'Infinity', '-Infinity', '""', '"a"', '1e999', '-0.0', '[[]]',
    '{}', '"\\ud800"',
    '1111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111111',
    '"format"', '"version"', '[0,0]',
    '"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"')
LVM_WORDS = (
    '***End_of_Header***\n', '\t', 'Separator\tComma\n', 'Decimal_Separator\t,\n', 'X_Columns\tMulti\n', 'X_Columns\tNo\n',
    'Samples\t1000000000\n', 'Channels\t3\n', 'X0\t', 'Delta_X\t0\n', 'Fx', 'Comment', '1e400', '\n\n')
# Of a grammar: `<name>` is grown by one of the productions of that name, from `start` on.
RAPID_GRAMMAR = {
    'start': (
        'MODULE <n>\n<decls>PROC main()\n<stats>ENDPROC\n<more>ENDMODULE\n',),
    'more': (
        '', '', 'PROC <n>()\n<stats>ENDPROC\n', 'PROC q(robtarget <n>)\n<stats>ENDPROC\n', 'ENDMODULE\nMODULE Two\n<decls>'),
    'decls': (
        '', '<decl>', '<decl><decls>', '<decl><decls>'),
    'decl': (
        '<sto>robtarget <n>:=<t>;\n', '<sto>robtarget <n>{2}:=[<t>,<t>];\n', '<sto>num <n>:=<v>;\n',
        '<sto>robtarget <n>;\n', '<sto>tooldata <n>:=[TRUE,[[<v>,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n',
        '<sto>pos <n>:=[<v>,<v>,<v>];\n', '<sto>speeddata <n>:=[<v>,500,5000,1000];\n'),
    'sto': (
        'CONST ', 'PERS ', 'VAR ', 'LOCAL CONST ', 'LOCAL PERS ', 'TASK PERS '),
    'stats': (
        '', '<stat>', '<stat><stats>', '<stat><stats>', '<stat><stats>'),
    'stat': (
        'MoveL <a>,v100,z1,tool0;\n', 'MoveJ <a>,v50,fine,tool0;\n', 'MoveC <a>,<a>,v50,z1,tool0\\WObj:=wobj0;\n',
        '<n>:=<a>;\n', 'MoveL <a>,<n>,z1,<n>;\n', 'IF <v>>1 THEN\n<stats>ENDIF\n',
        'FOR <n> FROM 1 TO 3 DO\n<stats>ENDFOR\n', '<n> <a>;\n', 'TriggL <a>,v50,gun,z1,tool0;\n',
        'WHILE TRUE DO\n<stats>ENDWHILE\n', '! <n> <a>;\n', 'MoveL <n>{<v>},v50,z1,tool0;\n', '<sto>robtarget <n>:=<t>;\n',
        'IF <v>=1 MoveL <a>,v50,z1,tool0;\n', '<n>.trans.x:=<v>;\n', 'VAR robtarget <n>:=<a>;\n'),
    'a': (
        '<n>', '<n>', '<n>', '<t>', 'Offs(<a>,<v>,<v>,<v>)', 'RelTool(<a>,<v>,<v>,<v>\\Rz:=<v>)', '<n>{1}', 'CRobT()', '*'),
    't': (
        '[[<v>,<v>,<v>],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]',
        '[<n>,[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]',
        '[[<v>,<v>,<v>],[0.7071068,0,0.7071068,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]', '<n>'),
    'n': (
        'p1', 'P1', 'p2', 'p3', 'p1_c1', 'main', 'q', 'tool0', 'n'),
    'v': (
        '0', '-1', '1.5', '600.25', '1e3', '-.5', '9E9', '1e300', '00012.5', '+3', '1e-320', '123456789.123456789', 'n',
        '<v>+<v>', '(<v>)', '-<v>'),
}
APT_GRAMMAR = {
    'start': (
        'PARTNO A\nUNITS/MM\n<stats>FINI\n', '<stats>'),
    'stats': (
        '<stat>', '<stat><stats>', '<stat><stats>', '<stat><stats>'),
    'stat': (
        'GOTO/<v>,<v>,<v>\n', 'GOTO/<v>,<v>,<v>,0,0,1\n', 'FEDRAT/<v>,MMPM\n', 'RAPID\n', 'GODLTA/<v>,<v>,<v>\n',
        'LOADTL/<v>\n', 'CIRCLE/<v>,<v>,<v>,0,0,1,<v>,0.1,0.1,1,0,TIMES,<v>\nGOTO/<v>,<v>,<v>\n',
        'INDIRV/<v>,1,0\nTLON,GOFWD/ (CIRCLE/<v>,<v>,<v>,<v>),ON,(LINE/<v>,<v>,<v>,<v>,<v>,<v>)\n',
        'MOVARC/<v>,<v>,<v>,0,0,1,<v>,ANGLE,<v>\nGOTO/<v>,<v>,<v>\n',
        'CYCLE/DEEP,DEPTH,<v>,STEP,<v>,CLEAR,<v>,MMPM,60,RETURN,<v>\nGOTO/<v>,<v>,<v>\nCYCLE/OFF\n', 'UNITS/INCHES\n',
        'TRACUT/1,0,0,<v>,0,1,0,<v>,0,0,1,<v>\n', 'CYCLE/DRILL,<v>,<v>,MMPM\nGOTO/<v>,<v>,<v>\nCYCLE/OFF\n', '$$ <v>\n',
        'SPINDL/<v>,RPM,CLW\n', 'MULTAX/ON\n', 'ROTABL/<v>\n'),
    'v': (
        '0', '-1', '1.5', '600.25', '1e3', '-.5', '9E9', '1e300', '00012.5', '+3', '1e-320', '123456789.123456789', '600',
        '20', '5', '10', '0.1'),
}
YAML_GRAMMAR = {
    'start': (
        'robot: irb6660-205-1.90\ntool: <m>\n<rest>', '<m>\n',
        'robot: irb6660-205-1.90\ntool: {position_mm: [1, 2, 3], quaternion: [1, 0, 0, 0]}\n<rest>'),
    'rest': (
        '', '<key>: <m>\n<rest>', '<key>: <m>\n<rest>'),
    'key': (
        'base_frame', 'workobject', 'measurement', 'prior', 'force_log', 'limits', 'modbus', 'controller', 'design',
        'cutting', 'motion', 'mechanical_units', '<v>', 'robot', '&x a', '? [a]'),
    'm': (
        '<v>', '[<m>, <m>, <m>]', '{<in>: <m>}', '{<in>: <m>, <in>: <m>}', '[]', '{}', '&x <m>', '*x', '!!str <v>'),
    'in': (
        'position_mm', 'quaternion', 'mass_kg', 'frame', 'columns', 'name', 'axes', 'host', 'folder', 'port',
        'deflection_std_um', 'eax', 'joint_window_deg', 'reach_mm', 'stiffness_nm_per_rad', 'material', 'max_offset_mm',
        'payload', 'carries'),
    'v': (
        '0', '-1', '1.5', '600.25', '1e3', '-.5', '9E9', '1e300', '00012.5', '+3', '1e-320', '123456789.123456789', 'base',
        "'x'", 'true', 'null', '~', '.inf', '2001-01-01', 'a: b', '0x1F', '"\\u0000"', '../../etc/passwd'),
}
